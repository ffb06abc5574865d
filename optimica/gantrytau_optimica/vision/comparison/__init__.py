"""Places by cameras beside those of a laser tracker."""
