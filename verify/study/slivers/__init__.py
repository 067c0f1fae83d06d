"""What slivers do: conditioning, explicit steps, errors and compliance against their size."""

from verify.study.slivers.growth import Growth, growth
from verify.study.slivers.measurement import Measurement
from verify.study.slivers.sweep import SliverStudy, sliver_study

__all__ = ["Growth", "Measurement", "SliverStudy", "growth", "sliver_study"]
