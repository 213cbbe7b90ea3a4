"""The person that a user pointed at: measurements that say who it is."""
