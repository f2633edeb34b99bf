"""Fields of classes in the reference: unit, default and comment, from the one line that declares each."""

import io
import itertools
import re
import tokenize

import griffe


LABEL = re.compile(r"""^\w+\(\s*['"](?P<name>[^'"\[]+) \[(?P<unit>[^\]]*)\]['"]""")
DEFAULT = re.compile(r"\bdefault=(?P<value>.+?)(?:, \w+=.*)?\)$", re.DOTALL)


SCENE, SOLVER = "scene that it was computed for", "name of the solver and its settings"
KIND, PLURAL = "its name in parameter paths and files", "name of several of them"
NAME = "name of the quantity"
PLAIN = {  # fields that are declared without a comment
    "StabilityChart.paths": "names of the two parameters",
    "StabilityChart.units": "their units",
    "LagBranch.angles": "positions of the balls [rad], one row a whirl rate",
    "LagBranch.rate": "whirl rates",
    "ZeroApproximation.rotor": "roots of the rotor without the balls",
    "Criterion.scene": "name of the scene",
    "Criterion.what": "what is asked for, in words",
    "Criterion.value": "number found",
    "Criterion.limit": "its limit",
    "Criterion.unit": "unit of both",
    "Criterion.passed": "whether it is met",
    "SceneAnalysis.scene": "the linear rotor that was analysed",
    "SceneAnalysis.map": "undamped critical speed map",
    "SceneAnalysis.campbell": "Campbell diagram",
    "SceneAnalysis.cases": "response to each unbalance case",
    "SceneAnalysis.stability": "Level I stability",
    "LateralAnalysis.machine": "data around the rotor",
    "LateralAnalysis.scenes": "answers by the names of the scenes",
    "CaseResponse.case": "the unbalances",
    "Probe.name": "name for tables",
    "Clearance.name": "name for tables",
    "Stage.name": "name for tables",
    "Stage.kind": "impeller or blade row",
    "Machine.probes": "probes of displacement",
    "Machine.clearances": "close clearances",
    "Machine.stages": "what drives forward whirl",
    "Machine.name": "name for the title of a report",
    "Campbell.frame": 'axes of constant coefficients, "fixed", "rotating" or "periodic"',
    "Crossings.damping_ratio": "damping ratio of the whirl at each crossing [1]",
    "AxisSpeeds.across": "critical speeds across the axis [rad/s]",
    "AxisSpeeds.along": "critical speeds along the axis [rad/s]",
    "StabilityMap.paths": "names of the two parameters",
    "StabilityMap.units": "their units",
    "Modes.frame": 'axes of constant coefficients, "fixed", "rotating" or "periodic"',
    "Reduction.shaft": "massless shaft with the same elasticity at the station",
    "Pilot.what": "name of the setting, in the plural",
    "Pilot.setting": "value that was chosen",
    "History.loss": "loss, one row a start",
    "Tuned.history": "steps of the search",
    "Tuned.optimiser": "name of the optimiser",
    "Tuned.scene": "tuned scene",
    "Tuned.seed": "seed of the random starts",
    "Uncertainty.covariance": "covariance C, SI",
    "AbstractRub.at": "station of the contact [m]",
    "AbstractRub.kind": KIND,
    "AbstractRub.plural": PLURAL,
    "AbstractBodies.at": "station of the race [m]",
    "AbstractCasing.name": "name by which supports refer to it",
    "AbstractContact.at": "station of the contact [m]",
    "AbstractEffect.kind": KIND,
    "AbstractEffect.plural": PLURAL,
    "Casing.name": "name by which supports refer to it",
    "CoaxialShaft.body": "model of the shaft, with stations from its own left end on",
    "Continued.q": "coordinates",
    "Continued.velocity": "their velocities",
    "Launch.shaft": "state of the shaft",
    "System.blocks": "matrices of all linear parts",
    "System.line": "elastic line of the shaft and of casings",
    "System.load": "unbalance and weight",
    "System.ports": "stations with nonlinear laws",
    "System.races": "races of balls",
    "System.spin": "law of rotation",
    "Variant.number": "row of the table, 1 to 30",
    "TimeHistory.scene": SCENE,
    "TimeHistory.solver": SOLVER,
    "Reactions.names": "names of bearings, constraints and stops",
    "Reactions.scene": SCENE,
    "Bifurcation.kind": 'kind, as "fold" or "flip"',
    "BranchPoint.kind": 'kind, as "fold" or "flip"',
    "BifurcationCurve.condition": "equation that holds along the curve",
    "BifurcationCurve.points": "points of codimension two",
    "BifurcationCurve.problem": "equations of the orbits over both parameters",
    "BifurcationCurve.radius_max": "largest radius [m] of every orbit, by station",
    "BifurcationCurve.side": "unit vectors across the curve, in units of the ranges, to where there are "
    "two orbits (fold), the critical multipliers are inside the unit circle (flip, neimark-sacker), or "
    "the clearance is positive (grazing)",
    "BifurcationCurve.unknowns": "unknowns of the problem, one row an orbit",
    "BifurcationCurve.unlocated": "points after which one of codimension two was not located",
    "CurvePoint.kind": 'kind, as "cusp" or "1:2 resonance"',
    "Branch.curve": "equations of the orbits along the branch",
    "Branch.max_iterations": "largest number of iterations of the corrector",
    "Branch.radius_max": "largest radius [m] of every orbit, by station",
    "Branch.tolerance": "tolerance of the corrector",
    "Branch.unknowns": "unknowns of the problem, one row an orbit",
    "Branch.unlocated": "points after which a bifurcation was not located, with its kind",
    "HarmonicOrbit.converged": "whether the iteration met its tolerance",
    "HarmonicOrbit.iterations": "number of Newton iterations",
    "HarmonicOrbit.scene": SCENE,
    "Torus.converged": "whether the iteration met its tolerance",
    "Torus.iterations": "number of Newton iterations",
    "Torus.scene": SCENE,
    "TorusBranch.curve": "equations of the tori along the branch",
    "TorusBranch.radius_max": "largest radius [m] of every torus, by station",
    "TorusBranch.unknowns": "harmonics and place of the parameter, one row a torus",
    "Lyapunov.scene": SCENE,
    "Lyapunov.solver": SOLVER,
    "PeriodicOrbit.converged": "whether the iteration met its tolerance",
    "PeriodicOrbit.error": "estimated errors, where they were asked for",
    "PeriodicOrbit.iterations": "number of Newton iterations",
    "PeriodicOrbit.scene": SCENE,
    "PeriodicOrbit.solver": SOLVER,
    "Scene.assumption": "what of the rotor is assumed; empty if nothing is",
    "Scene.effects": "parts on and around the shaft",
    "Scene.layouts": "spans between the stations of every shaft, and their nodes",
    "Scene.name": "name of the first shaft, where there are several",
    "Scene.shaft": "model of the shaft",
    "Scene.spin": "law of rotation",
    "FlexibleShaft.constraints": "where the shaft is held",
    "RigidShaft.constraints": "where the shaft is held",
    "FlexibleShaft.material": "material of the shaft, by default steel",
    "AbstractShaft.length": "length [m]",
    "AbstractObservable.needs_contact": "whether it is defined only for scenes with contacts",
    "AbstractObservable.rows": "whether `update` takes lanes along a last axis, or one without it",
    "Variable.dims": "names of the dimensions",
    "Variable.long_name": "description, as labels of axes have it",
    "Variable.units": "unit",
    "Variable.values": "values",
    "FinalState.name": NAME,
    "LongRun.name": NAME,
    "Reaction.name": "name of a bearing, constraint or stop, as `reactions` has it",
    "Method.axis": "which setting is refined",
    "Method.name": "name, as legends have it",
    "Method.settings": "settings to try, from loose to tight",
}
UNDESCRIBED = "This field has no description."  # `docs/hooks.py` refuses a page that has it


class Fields(griffe.Extension):
    """Adds an `Attributes:` section to the docstring of every class with annotated fields."""

    def on_class_members(self, *, cls, **_):
        """Describes fields once the class is read."""
        lines = [line for one in cls.attributes.values() if (line := _described(one))]
        if lines and cls.docstring is not None:
            text = "\n".join(f"    {line}" for line in lines)
            cls.docstring.value = f"{cls.docstring.value}\n\nAttributes:\n{text}"


def _described(field):
    """`name: comment [unit], by default value`; None for what is no field."""
    if field.name.startswith("_") or "instance-attribute" not in field.labels:
        return None
    value = str(field.value or "")
    label, default = LABEL.match(value), None
    if label or value.startswith("eqx.field"):
        found = DEFAULT.search(value)
        default = found and found["value"]
    else:
        default = (
            None if value.startswith("_") or "(" in value.removesuffix("()") else value or None
        )
    parts = [_comment(field) or (f"[{label['unit']}]" if label else "")]
    if default is not None:
        parts.append("absent by default" if default == "None" else f"by default `{default}`")
    text = ", ".join(part for part in parts if part)
    text = text or PLAIN.get(f"{field.parent.name}.{field.name}", UNDESCRIBED)
    return f"{field.name}: {text}"


def _comment(field):
    """What stands behind the declaration, or above it, or below it."""
    lines = field.filepath.read_text("utf-8").splitlines()
    is_comment = lambda line: line.startswith("    # ")
    above = list(itertools.takewhile(is_comment, reversed(lines[: field.lineno - 1])))
    below = [line for line in lines[field.endlineno :][:1] if is_comment(line)]
    for near in (field.lines, above[::-1], below):
        if found := _behind("\n".join(line.strip() for line in near)):
            return found
    return ""


def _behind(source):
    """Comments of some lines, as one text."""
    try:
        tokens = list(tokenize.generate_tokens(io.StringIO(source).readline))
    except (tokenize.TokenError, IndentationError):
        return ""
    comments = [one.string.lstrip("# ") for one in tokens if one.type == tokenize.COMMENT]
    return " ".join(comments)
