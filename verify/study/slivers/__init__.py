"""Effect of cuts near to nodes on a solver: errors, conditioning, explicit steps."""

from verify.study.slivers.study import SliverStudy, sliver_study

__all__ = ["SliverStudy", "sliver_study"]
