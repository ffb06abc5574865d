"""Examples of components, run when the site is built: their code, picture and equations."""
