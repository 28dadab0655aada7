"""Smooth motions through waypoints; `Interpolator` is the core of `interpolation_node.py`.

The exported functions and the class `TCubicHermiteSpline` have the names and arguments of this project's original
release.
"""

from .release import TCubicHermiteSpline as TCubicHermiteSpline
from .release import interpolate_cubic_hermite_spline as interpolate_cubic_hermite_spline
from .release import interpolate_cubic_hermite_spline_source_code as interpolate_cubic_hermite_spline_source_code
from .release import interpolate_cubic_quaternions as interpolate_cubic_quaternions
from .release import interpolate_cubic_spline as interpolate_cubic_spline
from .release import interpolate_interp1d as interpolate_interp1d
from .release import interpolate_linearly_quaternions as interpolate_linearly_quaternions
from .release import interpolate_poly_fit as interpolate_poly_fit
from .release import plot_interpol_results as plot_interpol_results
from .release import poly5 as poly5
