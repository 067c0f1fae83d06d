"""Parts of the error of an XFEM answer, and the cheapest model that is good enough."""
