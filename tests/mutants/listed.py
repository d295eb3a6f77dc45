"""The mutants: by file (formula, source text with the mutated part in guillemets, what stands there instead).

The text must occur once in its file. The part is an expression, or a statement ending with a semicolon.
"""

import of_cells
import of_games
import of_newton
import of_riccati
import of_simd
import of_synthesis
import of_worlds

ALL = [of_simd, of_riccati, of_newton, of_synthesis, of_games, of_worlds, of_cells]
MUTANTS = {file: mutants for part in ALL for file, mutants in part.MUTANTS.items()}

# Mutants that no test can tell from the program: (file, formula): why.
EQUIVALENT = {
    (
        "synthesis/theta/problem.rs",
        "W_p: sign",
    ): "Θ, its derivatives and the certificate hold W_p twice in every product",
    (
        "synthesis/newton/tile.rs",
        "a pivot to divide by",
    ): "a refused lane is not used, and empty unknowns stand among zeros",
    (
        "synthesis/newton/factor_one.rs",
        "registers: empty unknowns, first",
    ): "every tile holds an unknown, the first one",
    ("synthesis/newton/factor_one.rs", "registers: eight rows"): "two tiles one after the other give the same bits",
    ("cost/quadrature.rs", "J: Horner"): "it turns z around, and costs are quadratic in z",
    ("network/sight.rs", "rounded root, down"): "the next loop climbs back to the same number",
}
