"""Methods given by Butcher tableaux, each kind in a file of its own."""

from .partitioned import PartitionedRungeKutta as PartitionedRungeKutta
from .runge_kutta import RungeKutta as RungeKutta
from .runge_kutta import TableauWarning as TableauWarning
