"""Who may do what on the robot's bus, and the certificates and passwords that tell them apart."""
