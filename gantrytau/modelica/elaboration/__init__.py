"""From trees of Modelica text to classes of the language: lookup, modifications, values, equations."""
