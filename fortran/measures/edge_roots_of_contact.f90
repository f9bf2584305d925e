!> Tractions with a root at an edge, for the stress next to it: the pressure at the edge of the contact, where slipping nodes carry
!> shear in proportion to it, and the reserve of friction at the edge of the stick area.
!>
!> Equations: docs/theory/interior.md, (I19) and (I22).
module hc_edge_roots_of_contact
  use hc_precision, only: wp
  use hc_lattice, only: lattice_t
  use hc_stress_at_edges, only: edge_traction_t
  use hc_contact_edges, only: contact_edges_t
  use hc_zone_edge, only: zone_edge_t
  implicit none
  private

  public :: new_edge_of_contact, new_edge_of_stick

contains

  !> Set up the pressure at the edge of the contact; a slipping node carries mu p along the slip.
  pure subroutine new_edge_of_contact(edge, lattice, edges, zones, friction, traction, corrected)
    !> To be set up
    type(edge_traction_t), intent(out) :: edge
    !> Lattice and window
    type(lattice_t), intent(in) :: lattice
    !> Edges of the contact
    type(contact_edges_t), intent(in) :: edges
    !> Nodes in contact, that can touch, that stick (n_col, n_row, 3)
    logical, intent(in) :: zones(:, :, :)
    !> Coefficient of friction, 0 if shear tractions do not follow the pressure (n_col, n_row)
    real(wp), intent(in) :: friction(:, :)
    !> Pressure and shear traction at the nodes, and corrected at the edges (n_col, n_row, 3) [Pa]
    real(wp), intent(in) :: traction(:, :, :), corrected(:, :, :)
    type(zone_edge_t) :: outline
    integer :: k

    edge%lattice = lattice
    edge%zone = zones(:, :, 1)
    edge%field = corrected(:, :, 1)
    edge%squares = traction(:, :, 1)**2
    edge%distance = edges%contact_distances()
    outline = edges%contact_edge()
    edge%segments = outline%segments
    allocate (edge%shares(size(friction, 1), size(friction, 2), 3), source=0.0_wp)
    edge%shares(:, :, 1) = 1.0_wp
    do k = 2, 3
      where (edge%zone .and. .not. zones(:, :, 3) .and. friction > 0.0_wp .and. traction(:, :, 1) > 0.0_wp)
        edge%shares(:, :, k) = traction(:, :, k)/traction(:, :, 1)
      end where
    end do
  end subroutine new_edge_of_contact

  !> Set up the reserve mu p - |q| at the edge of the stick area, which the shear traction is short of.
  pure subroutine new_edge_of_stick(edge, lattice, edges, zones, friction, traction, corrected)
    !> As of `new_edge_of_contact`
    type(edge_traction_t), intent(out) :: edge
    type(lattice_t), intent(in) :: lattice
    type(contact_edges_t), intent(in) :: edges
    logical, intent(in) :: zones(:, :, :)
    real(wp), intent(in) :: friction(:, :), traction(:, :, :), corrected(:, :, :)
    real(wp), allocatable :: reserve(:, :), shear(:, :)
    type(zone_edge_t) :: outline
    integer :: k

    edge%lattice = lattice
    edge%zone = zones(:, :, 3)
    shear = norm2(traction(:, :, 2:3), dim=3)
    allocate (reserve, edge%field, mold=shear)
    reserve = merge(max(friction*traction(:, :, 1) - shear, 0.0_wp), 0.0_wp, edge%zone)
    ! signed, since corrected tractions are negative at some nodes; those outside the contact belong to its own edge
    edge%field = 0.0_wp
    where (zones(:, :, 1) .and. shear > 0.0_wp) edge%field = friction*corrected(:, :, 1) &
                                                             - sum(corrected(:, :, 2:3)*traction(:, :, 2:3), dim=3)/shear
    edge%squares = reserve**2
    edge%distance = edges%stick_distances(edge%zone, reserve)
    outline = edges%stick_edge(edge%zone, reserve)
    edge%segments = outline%segments
    allocate (edge%shares(size(friction, 1), size(friction, 2), 3), source=0.0_wp)
    do k = 2, 3
      where (shear > 0.0_wp) edge%shares(:, :, k) = -traction(:, :, k)/shear
    end do
  end subroutine new_edge_of_stick

end module hc_edge_roots_of_contact
