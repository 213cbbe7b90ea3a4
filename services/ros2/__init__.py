"""ROS 2 on one side, Heel's topics on the other: a robot's camera, ranges, odometry and wheels."""
