"""Theory of the ball auto-balancer in closed form, on dimensionless groups."""

from .boundary import (
    StabilityChart as StabilityChart,
    polar_limit as polar_limit,
    stability_chart as stability_chart,
    stability_speed as stability_speed,
)
from .cautions import cautions as cautions
from .groups import BalancerGroups as BalancerGroups, Scales as Scales, groups_of as groups_of
from .linear import (
    Zeros as Zeros,
    ball_momenta as ball_momenta,
    ball_spectrum as ball_spectrum,
    closed_matrix as closed_matrix,
    final_displacement as final_displacement,
    first_integral as first_integral,
    growth_rate as growth_rate,
    integral_rows as integral_rows,
    spectrum as spectrum,
    zero_count as zero_count,
)
from .polynomial import (
    FirstApproximation as FirstApproximation,
    ZeroApproximation as ZeroApproximation,
    boundary_shift as boundary_shift,
    characteristic_polynomial as characteristic_polynomial,
    first_approximation as first_approximation,
    slow_polynomial as slow_polynomial,
    zero_approximation as zero_approximation,
)
from .positions import (
    CriticalCases as CriticalCases,
    balance_margin as balance_margin,
    balanced_positions as balanced_positions,
    critical_cases as critical_cases,
    critical_count as critical_count,
    imbalance as imbalance,
    labellings as labellings,
    nearest_balanced as nearest_balanced,
    packed_factor as packed_factor,
    pitch as pitch,
    row_imbalances as row_imbalances,
    second_harmonics as second_harmonics,
    smallest_gap as smallest_gap,
)
from .settling import Settling as Settling, settling_time as settling_time
from .slow import slow_motion as slow_motion, slow_rates as slow_rates
from .whirl import (
    LagBranch as LagBranch,
    LagWhirl as LagWhirl,
    SynchronousState as SynchronousState,
    lag_branch as lag_branch,
    lag_fold as lag_fold,
    lag_whirl as lag_whirl,
    synchronous_states as synchronous_states,
    whirl_spectrum as whirl_spectrum,
    wrong_side_speed as wrong_side_speed,
)
