"""Networks that find people, in ONNX files: a picture in, boxes and scores out."""
