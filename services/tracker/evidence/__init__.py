"""Measurements from the evidence map: person-shaped templates fitted jointly to it."""
