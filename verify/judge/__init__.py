"""The judge: what measured numbers say about what a case demands, in this order of files.

1. `quantities`, `stress_intensity` and `contact` measure what a case asks for, with
   `verify.compare`.
2. `convergence` and `reference` say how well a number is known, `intervals` how far from the truth
   it lies at least and at most. `accuracy` does this for all solves of a case.
3. `checks` makes each demand of a case one of each solver that it holds for.
4. `verdict` holds the intervals against the demands: PASS, FAIL, UNDECIDED or ERROR.
5. `cost` takes times at equal error, `pairs` compares solvers two by two, and `ranks` puts
   together every question that a run answers.

Beside the verdicts stand `notices`, overlaps (`openings`), and what the model of a case costs
(`models`). The judge solves nothing and writes nothing.
"""
