"""A robot that speaks ROS 2 in the simulated world, and Heel beside it."""
