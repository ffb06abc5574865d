"""External functions of the Modelica Standard Library, on functions of our own."""
