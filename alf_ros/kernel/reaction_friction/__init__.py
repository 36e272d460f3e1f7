"""Friction under the reactions that it changes itself.

The friction of a joint depends on its reaction R, and R is a result of the solve that needs the
friction. A balance is a set of loads N with N = |R(N)|; R is linear in N.

Where friction changes reactions little there is one balance. A few passes of the fixed point with
Anderson's mixing find it; each pass is a solve that continues the last one. At the distance c from
a singular position friction changes reactions as 1/c. There may be several balances or none
(Painlevé's paradox). Then all of R(N) is computed, by one solve for each load, and Newton's method
finds a root of N - |R(N)| without further solves. It begins with the last directions of R, because
they distinguish balances that are close together.

The sense of a balance is the sign of det(1 - d|R|/dN). Without friction it is +. A balance that
changes continuously with the motion keeps c times that determinant off zero: where the product
vanishes, the balance meets another one and both end. So its sense stays, except that it changes
where c changes sign, if friction feels that singular position. A stage that finds no balance of
this sense lies beyond the end of the balance, also if a coarse step has passed over the end.

`balance` makes the solve, of which `cut_reactions` gives R, `anderson_mixing` the passes of the
fixed point, `load_response` all of R(N), `load_newton` Newton's method, `least_share` the λ of
redundant rows, and `singular_side` the sign of c. The kernel calls the solve through a function
pointer, so a scene without such friction does not compile it.
"""

from alf_ros.kernel.reaction_friction.anderson_mixing import MEMORY
from alf_ros.kernel.reaction_friction.balance import settle

__all__ = ['MEMORY', 'settle']
