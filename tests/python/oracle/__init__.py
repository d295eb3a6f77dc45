"""A plain NumPy and SciPy reading of the paper, against which tadcore is compared.

Nothing here imports tadcore. The matrices of the full, Kronecker form are built as printed; the reduced form
appears where a search over many starts would not be feasible otherwise, and is itself checked against the full one.

=============  =====================================================================
module         what it computes
=============  =====================================================================
model          weights, the paper's B, S, Q, F; the eight runs of section 6
riccati        eq:Riccati and eq:RDE in full, the Hamiltonian closed form, the escape time of I2
escape         escape times of I1 in extended precision
decimals       P of a duel of I2 to hundreds of digits
network        Ad, Phi, A and I_i in full
theta          Theta_1, Theta_2, their terms and the printed gradients in 2 x 2 blocks
search         a trust-region Newton method in real or complex gains
synthesis      the best of many starts at one (instant, network)
philox         Philox4x32-10 and the numbers that are drawn from it
chains         sensors, edges and links that fail and come back, by their flips
relay          who is told what
worlds         failures, links and disturbances of one trial
stepping       a sampled-data run, network changes, outcome
costs          J_d, J_tau, J_a and J along a run
scenario       the same game as a mapping in the words of a tadcore scenario
=============  =====================================================================
"""
