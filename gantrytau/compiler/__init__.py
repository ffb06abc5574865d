"""From a flat model to equations of index one, sorted into blocks."""
