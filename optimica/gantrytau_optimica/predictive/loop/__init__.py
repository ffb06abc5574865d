"""The loop of a predictive controller and a plant: a model, or one that runs by itself."""
