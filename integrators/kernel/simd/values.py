"""A vector of doubles in LLVM code under construction, with the operators that functions of lanes need."""

from typing import Any

from llvmlite import ir

from integrators.kernel.simd.emit import INTEGER, llvm_call, vector


class Value:
    """A vector under construction, with the operators that formulas need."""

    def __init__(self, builder: Any, value: Any):
        self.builder, self.value = builder, value
        self.count = value.type.count

    def _operand(self, other: "Value | float") -> Any:
        if isinstance(other, Value):
            return other.value
        return ir.Constant(vector(self.count), [float(other)] * self.count)

    def constant(self, number: float) -> "Value":
        """Return the number in every lane."""
        return self._make(self._operand(number))

    def _make(self, value: Any) -> "Value":
        return Value(self.builder, value)

    def __add__(self, other: "Value | float") -> "Value":
        return self._make(self.builder.fadd(self.value, self._operand(other)))

    def __sub__(self, other: "Value | float") -> "Value":
        return self._make(self.builder.fsub(self.value, self._operand(other)))

    def __rsub__(self, other: float) -> "Value":
        return self._make(self.builder.fsub(self._operand(other), self.value))

    def __radd__(self, other: float) -> "Value":
        return self + other

    def __rmul__(self, other: float) -> "Value":
        return self * other

    def __rtruediv__(self, other: float) -> "Value":
        return self._make(self.builder.fdiv(self._operand(other), self.value))

    def __mul__(self, other: "Value | float") -> "Value":
        return self._make(self.builder.fmul(self.value, self._operand(other)))

    def __truediv__(self, other: "Value | float") -> "Value":
        return self._make(self.builder.fdiv(self.value, self._operand(other)))

    def __neg__(self) -> "Value":
        return self._make(self.builder.fneg(self.value))

    def fma(self, factor: "Value | float", term: "Value | float") -> "Value":
        """Return the value times a factor plus a term, rounded once."""
        return self._make(
            llvm_call(self.builder, "fma", self.value, self._operand(factor), self._operand(term))
        )

    def polynomial(self, coefficients: Any) -> "Value":
        """Horner's scheme, lowest coefficient first."""
        result = self._make(self._operand(coefficients[-1]))
        for coefficient in reversed(coefficients[:-1]):
            result = result.fma(self, coefficient)
        return result

    def where(self, condition: Any, other: "Value | float") -> "Value":
        """Choose the value where the condition holds, else ``other``."""
        return self._make(self.builder.select(condition, self.value, self._operand(other)))

    def compare(self, symbol: str, other: "Value | float") -> Any:
        return self.builder.fcmp_ordered(symbol, self.value, self._operand(other))

    def integers(self) -> Any:
        return self.builder.bitcast(self.value, ir.VectorType(INTEGER, self.count))

    def whole(self, number: int) -> Any:
        return ir.Constant(ir.VectorType(INTEGER, self.count), [number] * self.count)

    def doubles(self, integers: Any) -> "Value":
        return self._make(self.builder.bitcast(integers, vector(self.count)))

    def absolute(self) -> "Value":
        return self._make(llvm_call(self.builder, "fabs", self.value))
