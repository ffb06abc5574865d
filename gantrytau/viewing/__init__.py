"""Pictures of models: what their components look like, in a pose or in motion, on one page for any browser."""
