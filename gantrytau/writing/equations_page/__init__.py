"""The equations of a model as one page of HTML, complete in itself."""
