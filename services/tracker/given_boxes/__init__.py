"""The tracker on given boxes: those of a MOTChallenge det.txt in, identities out."""
