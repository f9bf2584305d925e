!> Tractions with a root at an edge, for the stress next to it: the pressure at the edge of the contact, where slipping nodes carry
!> shear in proportion to it, and the reserve of friction at the edge of the stick area.
!>
!> Equations: docs/theory/interior.md, (I19) and (I22).
module hc_edge_roots_of_contact
  use hc_precision, only: wp
  use hc_lattice, only: lattice_t
  use hc_stress_at_edges, only: edge_traction_t
  use hc_friction_law, only: friction_law_t
  use hc_contact_edges, only: contact_edges_t
  use hc_zone_edge, only: edged_zone_t, zone_edge_t
  implicit none
  private

  public :: new_edge_of_contact, new_edge_of_stick

contains

  !> Set up the pressure at the edge of the contact; a slipping node carries shear in proportion to it.
  pure subroutine new_edge_of_contact(edge, lattice, edges, zones, friction, traction, corrected)
    !> To be set up
    type(edge_traction_t), intent(out) :: edge
    !> Lattice and window
    type(lattice_t), intent(in) :: lattice
    !> Edges of the contact
    type(contact_edges_t), intent(in) :: edges
    !> Nodes in contact, that can touch, that stick (n_col, n_row, 3)
    logical, intent(in) :: zones(:, :, :)
    !> Law of friction, one without friction if shear tractions do not follow the pressure
    class(friction_law_t), intent(in) :: friction
    !> Pressure and shear traction at the nodes, and corrected at the edges (n_col, n_row, 3) [Pa]
    real(wp), intent(in) :: traction(:, :, :), corrected(:, :, :)
    real(wp) :: bound(size(zones, 1), size(zones, 2))
    type(zone_edge_t) :: outline
    integer :: k

    bound = friction%bounds_of(traction(:, :, 1))
    edge%lattice = lattice
    edge%zone = zones(:, :, 1)
    edge%field = corrected(:, :, 1)
    edge%squares = traction(:, :, 1)**2
    edge%distance = edges%distances()
    outline = edges%edge()
    edge%segments = outline%segments
    allocate (edge%shares(size(edge%zone, 1), size(edge%zone, 2), 3), source=0.0_wp)
    edge%shares(:, :, 1) = 1.0_wp
    do k = 2, 3
      where (edge%zone .and. .not. zones(:, :, 3) .and. bound > 0.0_wp .and. traction(:, :, 1) > 0.0_wp)
        edge%shares(:, :, k) = traction(:, :, k)/traction(:, :, 1)
      end where
    end do
  end subroutine new_edge_of_contact

  !> Set up the reserve b(p) - |q| at the edge of the stick area, which the shear traction is short of.
  pure subroutine new_edge_of_stick(edge, lattice, edges, zones, friction, traction, corrected)
    !> As of `new_edge_of_contact`
    type(edge_traction_t), intent(out) :: edge
    type(lattice_t), intent(in) :: lattice
    type(contact_edges_t), intent(in) :: edges
    logical, intent(in) :: zones(:, :, :)
    class(friction_law_t), intent(in) :: friction
    real(wp), intent(in) :: traction(:, :, :), corrected(:, :, :)
    real(wp), allocatable :: reserve(:, :), shear(:, :), bound(:, :)
    type(edged_zone_t) :: sticking
    type(zone_edge_t) :: outline
    integer :: k

    edge%lattice = lattice
    edge%zone = zones(:, :, 3)
    shear = norm2(traction(:, :, 2:3), dim=3)
    allocate (reserve, edge%field, mold=shear)
    bound = friction%bounds_of(traction(:, :, 1))
    reserve = merge(max(bound - shear, 0.0_wp), 0.0_wp, edge%zone)
    ! signed, since corrected tractions are negative at some nodes; those outside the contact belong to its own edge
    edge%field = 0.0_wp
    bound = bound + friction%slopes_of(traction(:, :, 1))*(corrected(:, :, 1) - traction(:, :, 1))
    where (zones(:, :, 1) .and. shear > 0.0_wp) edge%field = bound - sum(corrected(:, :, 2:3)*traction(:, :, 2:3), dim=3)/shear
    edge%squares = reserve**2
    call edges%find_stick(edge%zone, reserve, sticking)
    edge%distance = sticking%distances()
    outline = sticking%edge()
    edge%segments = outline%segments
    allocate (edge%shares(size(edge%zone, 1), size(edge%zone, 2), 3), source=0.0_wp)
    do k = 2, 3
      where (shear > 0.0_wp) edge%shares(:, :, k) = -traction(:, :, k)/shear
    end do
  end subroutine new_edge_of_stick

end module hc_edge_roots_of_contact
