"""Person following for robots: one camera, CPU only, Python processes over Zenoh."""
