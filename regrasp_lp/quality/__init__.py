"""How good grasps are: measures of one grasp or many, the best of a set, maps, largest regions.

All measures are called alike, ``f(polygon, grasp, friction)`` of one grasp, and
``f(polygon, friction=…, edges=…, positions=…)`` of many at once; `margin` and `tolerance` are
``regrasp_lp.margin`` and ``regrasp_lp.tolerance``.
"""

from regrasp_lp.quality.best_grasps import BestGrasp, best
from regrasp_lp.quality.focus import focus_distance
from regrasp_lp.quality.friction_needed import required_friction
from regrasp_lp.quality.hulls import scale_of as torque_scale
from regrasp_lp.quality.maps import QualityMap, quality_map
from regrasp_lp.quality.regions import LargestRegions, largest_regions
from regrasp_lp.quality.stability import margin, tolerance
from regrasp_lp.quality.wrenches import epsilon, hull_volume, load_factor, squeezing_force

__all__ = [
    "BestGrasp",
    "LargestRegions",
    "QualityMap",
    "best",
    "epsilon",
    "focus_distance",
    "hull_volume",
    "largest_regions",
    "load_factor",
    "margin",
    "quality_map",
    "required_friction",
    "squeezing_force",
    "tolerance",
    "torque_scale",
]
