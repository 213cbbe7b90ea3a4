"""A robot on the loopback that is made to stop in every way: processes, camera, links, wheels."""
