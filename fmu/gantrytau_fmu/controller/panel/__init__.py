"""An operator panel for a controller somewhere: its values, the state switch, parameters; on the terminal or as a page."""

from gantrytau_fmu.controller.panel.panel_link import PanelLink
from gantrytau_fmu.controller.panel.terminal_panel import terminal_panel
from gantrytau_fmu.controller.panel.web_panel import WebPanel

__all__ = ["PanelLink", "WebPanel", "terminal_panel"]
