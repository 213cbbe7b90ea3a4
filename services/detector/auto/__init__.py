"""Which background can be believed: one that stands still, one that is carried along, or none."""
