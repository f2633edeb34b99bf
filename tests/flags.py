"""Settings of the compiler in tests, most of whose programs run once or twice."""

# Passes over loops, which the compiler repeats until nothing changes, up to 18 times: they take a
# third of the compilation of a large program.
LOOP_PASSES = "while-loop-invariant-code-motion,simplify-while-loops,while-loop-constant-sinking"
# What has nothing to do in a program of double precision, or makes it no smaller: yet each of them goes
# through all of it.
SMALL = "u4 s4 f8e8m0fnu f8e5m2fnuz f8e5m2 f8e4m3fnuz f8e4m3fn f8e4m3b11fnuz f8e4m3 f8e3m4 f4e2m1fn bf16"
IDLE_PASSES = (
    *(f"float-normalization-{kind}" for kind in SMALL.split()),
    *("tree_reduction_rewriter", "reshape-mover"),
    *("convolution-group-converter", "stochastic_convert_decomposer"),
)
PASSES = ",".join((LOOP_PASSES, *IDLE_PASSES))  # left out
# Without optimisation by LLVM and without fusion emitters; in one part, as the other core has tests of
# its own.
FLAGS = (
    "--xla_backend_optimization_level=0 --xla_cpu_use_fusion_emitters=false "
    f"--xla_cpu_parallel_codegen_split_count=1 --xla_disable_hlo_passes={PASSES}"
)
