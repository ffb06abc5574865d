"""`make library-results`: the examples of a Modelica library beside reference results in files."""
