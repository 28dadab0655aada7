"""Model predictive control by sampling. Forks of the world simulate candidate plans. The costs of these candidates
determine the executed plan.
"""

from .controller import SamplingConfig as SamplingConfig
from .controller import SamplingController as SamplingController
from .samplers import SAMPLERS as SAMPLERS
from .samplers import Sampler as Sampler
from .world import ForkedWorld as ForkedWorld
from .world import InputConfig as InputConfig
