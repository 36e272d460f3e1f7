"""All that knows LLVM: how code is compiled and cached, structs, vectors, calls by address."""
