"""Why each default of a scene file is neutral: the last words of the column "default" in its tables.

A key is "part.key", or the key alone where it means the same in every part. What is absent by default
needs no reason, unless something else is taken in its place.
"""

X = "the x axis"
WHY = {
    # what several parts have
    "angle": f"{X}, from which angles are counted",
    "offset": "centred on the straight axis",
    "damping": "no damper",
    "friction": "smooth surfaces",
    "rim_radius": "contact on the axis itself, where rotation alone does not slip",
    "blend": "the sharp law, as published",
    "slip": "the sharp law, as published",
    "on": "stands on the ground",
    "cavitated": "oil bears no tension, so the film ruptures",
    "modes": "the short film; see above how long it may be",
    "inner_diameter": "solid",
    # shafts
    "flexible.material": "`jaxrotor show` says so",
    "flexible.polar_ratio": "every round section has it",
    "flexible.nodes": "discretisation, no physics: as many as the waves need",
    "flexible.rule": "discretisation, no physics",
    "flexible.rotary_inertia": "sections have it",
    "flexible.steps": "none: a uniform shaft",
    "flexible.constraints": "none: only supports hold the shaft",
    "flexible.shear": "Bernoulli's beam, as of a slender shaft",
    "flexible.anisotropy": "round",
    "massless.k12": "absent: the slope is left out",
    "massless.k22": "absent: the slope is left out",
    "massless.anisotropy": "round",
    "massless.ends": "`k11` is that of ends at rest; parts at an end are refused",
    "rigid.constraints": "none: only supports hold the shaft",
    "step.inner_diameter": "solid",
    "step.material": "the shaft goes on",
    "constraint.holds": "the least that a constraint holds",
    "material.shear_modulus": "needed where `shear = true`",
    # effects
    "ball_balancer.rolling": "a solid ball that rolls without slip",
    "ball_balancer.in_use": "absent: all places hold a ball",
    "ball_balancer.ball_radius": "absent: needed where balls touch",
    "ball_balancer.places": "the fewest balls that can balance",
    "crack.loss": "given unless `compliance` is",
    "crack.loss_across": "it loses stiffness along its weak axis alone",
    "crack.compliance": "given unless `loss` is",
    "crack.compliance_across": "it yields to moments along its weak axis alone",
    "crack.tension": "the side below, as under weight",
    "crack.breathing": "smooth, so that every analysis of orbits takes it",
    "disc.diametral": "thin; without `polar` a point mass",
    "disc.polar": "a point mass",
    "disc.offset_angle": f"{X}; of no account without `offset`",
    "disc.tilt_axis": f"{X}; of no account without `tilt`",
    "disc.exact": "no approximation",
    "disc_damping.translational": "no damper",
    "disc_damping.angular": "no damper",
    "gravity.acceleration": "standard gravity",
    "gravity.angle": "downwards, as y points up",
    "loose_pedestal.bolt_damping": "bolts are springs",
    "loose_pedestal.play": "bolts hold as soon as it lifts",
    "loose_pedestal.angle": "the foundation is below",
    "rayleigh_damping.mass": "the other one alone",
    "rayleigh_damping.stiffness": "the other one alone",
    "magnetic_bearing.kp": "`numerator` and `denominator` in its place",
    "linear_magnetic_bearing.kp": "`numerator` and `denominator` in its place",
    "linear_magnetic_bearing.name": "of its coordinates; a second bearing needs another one",
    "rolling_bearing.exponent": "3/2: balls, by Hertz's law",
    "rolling_bearing.outer_speed": "the outer race stands",
    "rolling_bearing.linear": "linear analyses ask for it",
    "seal.inertia": "a fluid without mass",
    "seal.exponent": "0: coefficients of the centred shaft everywhere",
    "seal.swirl_exponent": "0: the same swirl everywhere",
    "support.one_sense": "a table is read at the magnitude of the speed unless it begins below 0",
    "support.hold": "nothing is assumed beyond a table: it is refused",
    "support.kyy": "as data sheets mean it",
    "support.cyy": "as data sheets mean it",
    "support.interpolation": "between nodes: smooth, and never beyond their values",
    "support.rotating": "bearings stand still",
    "unbalance.phase": f"{X} of the shaft, from which angles are counted",
    "disc given by its dimensions.density": "steel",
    "disc given by its dimensions.bore": "solid",
    "unbalance given by its grade.phase": f"{X} of the shaft, from which angles are counted",
    # rotation
    "drive.odd": "asked for where a drive with `drag` turns backward; of no account elsewhere",
    "drive.polar": "absent: that of shaft and discs",
    "drive.feedback": "the rotation is that of motor and resistance alone",
    "drive.stops": "the equation goes on through standstill",
}


def why(part: str, key: str) -> str:
    """Reason why a default is neutral; "" where there is none."""
    return WHY.get(f"{part}.{key}", WHY.get(key, ""))
