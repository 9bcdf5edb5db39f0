"""What a model leaves: whether it is the noise, and which readings, stamps and logs say nothing of the robot."""
