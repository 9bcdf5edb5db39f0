"""Prediction error: parameters and both noises, of process and sensors, by maximum likelihood of a filter's innovations."""
