"""TF in one object."""

from .ros.tf_interface import TfInterface

__all__ = ["TfInterface"]
