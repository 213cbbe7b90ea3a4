"""The default background: a mixture per pixel that learns only what no person covers.

MOG2 fed with a composite (protected pixels replaced by its own background) against this mixture,
same tracker, MOTA: PETS09-S2L1 91.1 and 90.9, PETS09-S3MF1 81.3 and 86.1, TownCentre-A 6 and 59, B
-147 and 58, C 5 and 43, at 11 and 6 ms a frame. MOG2 can neither wait for a pixel to come to rest
nor start over at some pixels: who is there in the first frame stays a ghost.
"""
