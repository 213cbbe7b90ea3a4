"""What every service shares: Zenoh session and QoS, service loop, health, settings, logs."""
