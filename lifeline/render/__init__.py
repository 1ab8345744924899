"""`lifeline render`: draw the robot as a picture or a film, with law and operator in simulated time."""
