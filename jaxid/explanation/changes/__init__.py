"""What changed between two sets of logs of one robot."""
