"""Settings of the compiler in tests, most of whose programs run once or twice."""

# Passes over loops, which the compiler repeats until nothing changes, up to 18 times: they take a
# third of the compilation of a large program.
LOOP_PASSES = "while-loop-invariant-code-motion,simplify-while-loops,while-loop-constant-sinking"
# Without optimisation by LLVM and without fusion emitters; in one part, as the other core has tests of
# its own.
FLAGS = (
    "--xla_backend_optimization_level=0 --xla_cpu_use_fusion_emitters=false "
    f"--xla_cpu_parallel_codegen_split_count=1 --xla_disable_hlo_passes={LOOP_PASSES}"
)
