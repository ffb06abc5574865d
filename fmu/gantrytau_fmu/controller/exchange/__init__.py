"""Samples over the network: messages, a server, clients, what they stream."""

from gantrytau_fmu.controller.exchange.remote_client import RemoteClient
from gantrytau_fmu.controller.exchange.run_client import Attended, run_client
from gantrytau_fmu.controller.exchange.server import Server
from gantrytau_fmu.controller.exchange.streams import (
    FileStream,
    FunctionClient,
    haptic_client,
    stream_file,
    stream_sensor,
)

__all__ = [
    "Attended",
    "FileStream",
    "FunctionClient",
    "RemoteClient",
    "Server",
    "haptic_client",
    "run_client",
    "stream_file",
    "stream_sensor",
]
