"""Compliance that neighbouring teeth share through the gear body, against finite elements."""

import math

import numpy as np
import pytest
import skfem
from scipy.sparse.linalg import splu
from skfem.models.elasticity import linear_elasticity

from gearlib.geometry import GearStage, Material, Rack, SpurGear
from gearlib.models.geometry.mesh_stiffness import Tooth

#: Numbers of elements across a tooth, across a gap, from bore to root, along a fillet, and along a
#: flank in each base pitch.
TOOTH_ELEMENTS, GAP_ELEMENTS, RADIAL_ELEMENTS, FILLET_ELEMENTS, ELEMENTS_PER_PITCH = 6, 3, 16, 6, 6
POISSON = 0.3


def grid_triangles(vertices):
    """Return the triangles, (3, n), of a rectangular grid of vertex numbers."""
    a, b = vertices[:-1, :-1].ravel(), vertices[:-1, 1:].ravel()
    c, d = vertices[1:, 1:].ravel(), vertices[1:, :-1].ravel()
    return np.hstack([[a, b, c], [a, c, d]])


class FiniteElementGear:
    """A plane-stress model of a whole gear with clamped bore, for E = 1 and width 1."""

    def __init__(self, tooth, phi):
        """Build and factorize the stiffness matrix; `phi` are the points of the flanks."""
        self.tooth, self.phi = tooth, phi
        gear, self.pitch = tooth.gear, math.tau / tooth.gear.teeth
        fillet = tooth.fillet(
            np.linspace(math.pi / 2.0, gear.transverse_pressure_angle, FILLET_ELEMENTS + 1)
        )
        x, y = (np.append(fillet[i], tooth.flank(phi)[i]) for i in range(2))
        half_angle, radius = np.arctan2(x, y), np.hypot(x, y)
        # The ring from the bore to the root circle; angles are clockwise from the first tooth.
        tooth_angles = half_angle[0] * np.linspace(-1.0, 1.0, TOOTH_ELEMENTS + 1)[:-1]
        gap_angles = np.linspace(half_angle[0], self.pitch - half_angle[0], GAP_ELEMENTS + 1)[:-1]
        root_angles = np.add.outer(
            self.pitch * np.arange(gear.teeth), np.append(tooth_angles, gap_angles)
        ).ravel()
        radii = np.geomspace(gear.bore / 2.0, radius[0], RADIAL_ELEMENTS + 1)
        angle, distance = [np.tile(root_angles, radii.size)], [np.repeat(radii, root_angles.size)]
        ring = np.arange(angle[0].size).reshape(radii.size, -1)
        elements, count = [grid_triangles(np.column_stack([ring, ring[:, 0]]))], ring.size
        self.flanks = []  # vertices of the clockwise flank of each tooth
        for tooth_number in range(gear.teeth):
            first = tooth_number * (TOOTH_ELEMENTS + GAP_ELEMENTS)
            root = ring[-1, (first + np.arange(TOOTH_ELEMENTS + 1)) % root_angles.size]
            rows = count + np.arange((radius.size - 1) * root.size).reshape(-1, root.size)
            count += rows.size
            spread = np.outer(half_angle[1:], np.linspace(-1.0, 1.0, root.size))
            angle.append(self.pitch * tooth_number + spread.ravel())
            distance.append(np.repeat(radius[1:], root.size))
            elements.append(grid_triangles(np.vstack([root, rows])))
            self.flanks.append(rows[FILLET_ELEMENTS:, -1])
        angle, distance = np.concatenate(angle), np.concatenate(distance)
        points = distance * np.array([np.sin(angle), np.cos(angle)])
        grid = skfem.MeshTri(points, np.hstack(elements))
        self.basis = skfem.Basis(grid, skfem.ElementVector(skfem.ElementTriP2()))
        elasticity = linear_elasticity(POISSON / (1.0 - POISSON**2), 0.5 / (1.0 + POISSON))
        matrix = elasticity.assemble(self.basis)
        bore = grid.facets_satisfying(lambda x: np.hypot(*x) < 0.501 * gear.bore)
        self.free = self.basis.complement_dofs(self.basis.get_dofs(bore))
        self.factors = splu(matrix[self.free][:, self.free].tocsc())
        self.root, self.root_angle = ring[-1], root_angles

    def unit_force(self, tooth_number, index):
        """Return the vector of a unit force on a flank, along the normal into the tooth."""
        _, _, b = self.tooth.flank(self.phi[index])
        angle, force = self.pitch * tooth_number - b, np.zeros(self.basis.N)
        vertex = self.flanks[tooth_number][index]
        force[self.basis.nodal_dofs[:, vertex]] = -math.cos(angle), math.sin(angle)
        return force

    def displacement(self, force):
        """Return the displacements under a force."""
        displacement = np.zeros(force.size)
        displacement[self.free] = self.factors.solve(force[self.free])
        return displacement

    def root_motion(self, displacement):
        """Return the mean motion of the root circle along the line of action."""
        x, y = displacement[self.basis.nodal_dofs[:, self.root]]
        tangential = y * np.sin(self.root_angle) - x * np.cos(self.root_angle)
        weights = (np.roll(self.root_angle, -1) - np.roll(self.root_angle, 1)) % math.tau
        ratio = self.tooth.base_radius / self.tooth.root_radius
        return np.average(tangential, weights=weights) * ratio


SLENDER_RACK = Rack(addendum=1.35, dedendum=1.6, tip_radius=0.2)


@pytest.mark.parametrize(
    ("teeth", "module", "bore", "rack", "distance"),
    [
        ((21, 58), 3.5e-3, 20e-3, "A", 1),
        ((50, 50), 3e-3, 50e-3, "A", 1),
        ((20, 20), 4e-3, 44e-3, "A", 1),
        ((50, 50), 4e-3, 60e-3, SLENDER_RACK, 2),
    ],
)
def test_shared_compliance_matches_finite_elements(teeth, module, bore, rack, distance):
    """Load one tooth and measure the motion of another on the same line of action.

    The mean over the path of contact must agree. The twist of the body, which is part of the shared
    compliance, has the closed form of a ring.
    """
    material = Material(young=1.0, poisson=POISSON)
    common = {"module": module, "width": 1.0, "rack": rack, "material": material}
    mesh = GearStage(*(SpurGear(teeth=z, bore=bore, **common) for z in teeth))
    tooth = Tooth(mesh.pinion, mesh.width)
    start, end = np.array(mesh.path) / tooth.base_radius
    # The next pair touches one base pitch further, where phi is larger by 2 pi / z.
    phi = np.arange(end, start, -math.tau / teeth[0] / ELEMENTS_PER_PITCH)[::-1]
    model, offset = FiniteElementGear(tooth, phi), distance * ELEMENTS_PER_PITCH
    compliances = []
    for index in range(offset, phi.size):
        displacement = model.displacement(model.unit_force(0, index))
        compliances.append(displacement @ model.unit_force(-distance, index - offset))
    assert np.mean(compliances) == pytest.approx(tooth.shared_compliance(distance), rel=0.01)
    twist = tooth.shared_compliance(1) - Tooth(mesh.pinion, 1.0, twist=False).shared_compliance(1)
    assert model.root_motion(displacement) == pytest.approx(twist, rel=2e-3)
