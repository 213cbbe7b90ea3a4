"""Frame sources: recordings, image folders, cameras and the drawn demo scene, as BGR frames."""
