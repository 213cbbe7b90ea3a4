"""The tracker as the paper prints it: blobs matched to people, groups that merge and split."""
