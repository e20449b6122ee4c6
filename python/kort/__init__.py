"""Which physics did your thruster's model leave out?

The functions do what the program's commands of the same name do, by the same code: :func:`read`, :func:`fit`,
:func:`diagnose`, :func:`simulate`, :func:`soak`. Their results are dataclasses that mirror the program's JSON documents.
:class:`Client` speaks with a running service. Quantities are SI; a name ends in its unit.
"""

from ._kort import __version__
from .client import Answer, Client, Command, Setpoint, State, Stream
from .diagnosis import Diagnosis, Finding, diagnose
from .fitting import Fit, fit
from .recording import Column, Gap, Recording, known_columns, read
from .reports import Channel, HeldOut, Parameter
from .simulation import simulate
from .soaking import Law, Scenario, Score, Soak, soak

__all__ = [
    "Answer", "Channel", "Client", "Column", "Command", "Diagnosis", "Finding", "Fit", "Gap", "HeldOut", "Law",
    "Parameter", "Recording", "Scenario", "Score", "Setpoint", "Soak", "State", "Stream", "__version__", "diagnose",
    "fit", "known_columns", "read", "simulate", "soak",
]  # fmt: skip
