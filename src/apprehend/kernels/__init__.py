"""Compiled code (Numba): numpy, numba and math only; no classes with methods, no strings, no input or output.

Rules (each learnt by measurement): decorate with `_jit.kernel`; a model reaches a kernel as one NamedTuple of arrays;
the batch loop is inside the kernel; small matrix products are loops; no kernel is passed as an argument; kernels
return status integers; parallel sums are reduced in a fixed order.
"""
