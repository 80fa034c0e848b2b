"""Run every benchmark: ``python -m benchmarks``."""

import importlib
import pkgutil

import benchmarks

for module in sorted(m.name for m in pkgutil.iter_modules(benchmarks.__path__) if not m.name.startswith("_")):
    print(f"\n=== {module} " + "=" * max(0, 70 - len(module)))
    importlib.import_module(f"benchmarks.{module}").main()
