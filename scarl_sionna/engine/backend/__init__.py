"""Which libraries the engine runs on: LLVM or CUDA, found before Dr.Jit is imported."""
