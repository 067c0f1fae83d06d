"""Base of every exact solution: its field, and the energy that it stores in a body."""

from reference.exact.energy import boundary_work, elastic_energy, outline_of
from reference.exact.field import Array, ExactField, Plane
from reference.exact.solid_energy import box_energy, box_of, surface_work
from verify.scene import Scene

__all__ = ["Array", "ExactSolution", "Plane"]


class ExactSolution(ExactField):
    """An exact field whose strain energy in a body is computed to round-off; see `ExactField`."""

    def strain_energy(self, body: Array | Scene) -> float:
        """Strain energy of a body, J (in the plane per metre of thickness), to 1e-11.

        Half the work of the tractions on the surface; with a body force, or a plane cut through
        the body in space, half the integral of stress times strain.

        Parameters
        ----------
        body : array or Scene
            In the plane: corners (k, 2) in order, or a scene whose geometry is a rectangle or
            polygon. In space: both corners (2, 3) of a box, or a scene with one.
        """
        if self.dimension == 3:
            corners = box_of(body)
            if self.cut_plane is None and not self.has_body_force:
                return surface_work(self, corners)
            return box_energy(self, corners)
        outline = outline_of(body)
        integrate = elastic_energy if self.has_body_force else boundary_work
        return integrate(self, outline)
