"""Where to measure so that the wanted orders can be separated."""

from .arc import plan_arc as plan_arc
from .limits import Limits as Limits
from .limits import load_limits as load_limits
from .nextruns import NextRuns as NextRuns
from .plan import HIGHEST_LOW_ORDER as HIGHEST_LOW_ORDER
from .plan import plan_encoder as plan_encoder
from .plan import plan_mounts as plan_mounts
from .plan import plan_tilts as plan_tilts
from .plan import readings_needed as readings_needed
from .plan import wanted_orders as wanted_orders
from .result import ArcPlan as ArcPlan
from .result import CalibrationPlan as CalibrationPlan
from .result import SelfPlan as SelfPlan
from .selfplan import plan_self as plan_self
