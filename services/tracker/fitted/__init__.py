"""The default tracker: person-shaped templates fitted jointly to the evidence map."""
