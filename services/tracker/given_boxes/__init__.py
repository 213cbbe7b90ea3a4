"""The tracker on somebody else's boxes: a MOTChallenge det.txt in, identities out."""
