"""Model predictive control by sampling. Candidate plans are simulated in forks of the world, and improve the executed
plan.
"""

from .controller import SamplingConfig as SamplingConfig
from .controller import SamplingController as SamplingController
from .samplers import SAMPLERS as SAMPLERS
from .samplers import Sampler as Sampler
from .world import ForkedWorld as ForkedWorld
from .world import InputConfig as InputConfig
