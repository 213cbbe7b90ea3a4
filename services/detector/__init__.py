"""Images to blobs: the background model and everything up to the true-blob test."""
