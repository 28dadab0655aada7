"""Runs the benchmarks, prints their figures as one table and writes them as JSON."""

from __future__ import annotations

import argparse
import importlib
import json
import os
import platform
import signal
import subprocess
import sys
import time
import traceback
from importlib.metadata import version
from pathlib import Path
from typing import Any

from result import Result, table

BENCHMARKS = (
    *("loop", "many", "load", "camera", "latency", "free_run", "reset", "tables"),
    *("ik", "ik_nodes", "device", "mvn", "grasp", "physics"),
)
