"""What a checkpoint belongs to."""

from dataclasses import dataclass
from typing import Any

from problems import targets
from problems.errors import InputError
from problems.problem import System


@dataclass(frozen=True)
class Identity:
    """The method, system and parameters of a trajectory; a checkpoint is restored only where they are equal.

    Attributes
    ----------
    method : str
        The method with all its options, as text.
    system, name : str
        The system's fingerprint and name.
    par : bytes
        The parameters' values.
    """

    method: str
    system: str
    name: str
    par: bytes

    @classmethod
    def from_system(cls, method: str, system: System, par: Any) -> "Identity":
        """Return that of a system with parameters, an array, integrated by a method."""
        return cls(method, targets.fingerprint(system), system.name, par.tobytes())

    def check(self, checkpoint: Any, kind: type) -> None:
        """Refuse what is no checkpoint of class ``kind``, or not one of this identity.

        Raises
        ------
        problems.errors.InputError
            With the method, system or parameters that differ.
        """
        other = getattr(checkpoint, "identity", None)
        if not isinstance(other, Identity):
            raise InputError(
                f"restore takes what checkpoint() has returned, not a {type(checkpoint).__name__}: "
                "give it a checkpoint of this program."
            )
        if (other.method, other.system) != (self.method, self.system) or type(checkpoint) is not kind:
            raise InputError(
                "this checkpoint belongs to another method or system: "
                f"{other.method} on {other.name}, not {self.method} on {self.name}"
                f"{' as it is defined here' if other.name == self.name else ''}; "
                "restore it in a stepper of the program that it is from."
            )
        if other.par != self.par:
            raise InputError(
                f"this checkpoint belongs to other parameters of {self.name}; restore brings none along: "
                "start a stepper with the same parameters."
            )
