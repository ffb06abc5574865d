"""Problems that are Optimica text, as classes of the language of optimisation problems."""
