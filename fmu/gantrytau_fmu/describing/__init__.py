"""The XML, the page, the licences and the icon of an FMU."""
