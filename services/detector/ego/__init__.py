"""A background that is carried along with a camera that moves."""
