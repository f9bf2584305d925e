!> Tractions of which the stress below the surface is computed: those at the nodes, corrected at the edges of the contact
!> and of the stick area.
!>
!> Joined linearly, the nodal tractions end one link beyond the last nodes in contact, while the true ones vanish like a
!> square root between the nodes. The shape between the nodes is taken from the edge; hats stand for it as well as they
!> can, and the tractions of the nodes inside are solved for again, so that the displacements of the nodes in contact stay
!> unchanged. The edge then follows from the corrected tractions. These have the load of the nodal ones,
!> and single nodes beyond the edge carry small ones of either sign.
!>
!> Equations: docs/theory/interior.md, (I16) to (I18).
module hc_edge_tractions
  use, intrinsic :: ieee_arithmetic, only: ieee_is_nan
  use hc_precision, only: wp, lk
  use hc_error, only: error_t, status, raise
  use hc_memory, only: require_memory
  use hc_options, only: edge_options_t
  use hc_lattice, only: lattice_t
  use hc_field_space, only: field_space_t
  use hc_elastic_medium, only: elastic_medium_t
  use hc_flexibility, only: normal, along_x, along_y
  use hc_flexibility_fft, only: fft_flexibility_t, new_fft_flexibility, fft_memory, of_pressure, of_all_tractions, spectra_of
  use hc_spectrum_cache, only: kernel_cache_t
  use hc_active_set, only: active_set_t, new_active_set
  use hc_linear_system, only: linear_system_t, constraints_t, iteration_t, solution_accurate, precondition_constraints
  use hc_projected_cg, only: projected_cg
  use hc_contact_edges, only: contact_edges_t
  use hc_zone_edge, only: edged_zone_t
  use hc_friction_law, only: friction_law_t
  use hc_traction_field, only: traction_field_t, new_traction_field
  use hc_edge_residue, only: edge_residue_t, new_edge_residue, edge_residue_memory, not_found
  use hc_edge_fit, only: fit_squares
  implicit none
  private

  public :: correct_at_edges, edge_tractions_memory

  !> The elastic operator of some components, without a preconditioner: changes are local.
  type, extends(linear_system_t) :: elastic_part_t
    type(fft_flexibility_t), pointer :: flexibility => null()
    integer, allocatable :: component(:)
    !> Accuracy and iterations of the solution
    type(edge_options_t) :: options
  contains
    procedure :: product => elastic_product
  end type elastic_part_t

contains

  !> Count the bytes that the correction takes, for a window and a contact of given sizes.
  pure integer(selected_int_kind(18)) function edge_tractions_memory(extent, n_contact, sheared, threads, n_spectrum)
    !> Number of columns and rows of the window
    integer, intent(in) :: extent(2)
    !> Nodes in contact
    integer, intent(in) :: n_contact
    !> Shear tractions are corrected, too
    logical, intent(in) :: sheared
    !> Threads to use
    integer, intent(in) :: threads
    !> Number of spectra of the two bodies
    integer, intent(in) :: n_spectrum
    integer, parameter :: long = selected_int_kind(18)
    !> Bytes of a field of numbers, and of one of integers or logical values
    integer, parameter :: field = 8, half = 4
    type(edge_options_t) :: tuning
    integer(long) :: everywhere, packed
    integer :: n, solved

    n = merge(3, 1, sheared)
    solved = merge(2, 1, sheared)
    ! edges: zones, places in the band; shape and nodes that stick; change, hats, values at the nodes; cells
    everywhere = 3*half + merge(11*field + half, 3*field, sheared) + 3*n*field + half
    ! displacements by the rest, and by the pressure; unknowns, product, right-hand side, constraints twice, active nodes
    everywhere = everywhere + merge(6, 1, sheared)*field + (3*solved + 2*solved**2)*field + solved*half
    ! vectors of conjugate gradients, constraints twice
    packed = (7*solved + 2*solved**2)*field
    edge_tractions_memory = everywhere*extent(1)*extent(2) + packed*n_contact &
                            + fft_memory(extent, .not. sheared, threads, n_spectrum) &
                            + merge(2, 1, sheared)*edge_residue_memory(n_contact, tuning%samples, n)
  end function edge_tractions_memory

  !> Correct pressure and shear traction at the edges.
  subroutine correct_at_edges(lattice, edges, medium, contact, stick, friction, traction, space, error, cache, options)
    !> Lattice and window
    type(lattice_t), intent(in) :: lattice
    !> Edges of the contact
    type(contact_edges_t), intent(in) :: edges
    !> The two bodies
    class(elastic_medium_t), intent(in) :: medium
    !> Nodes in contact, and those of them that stick (n_col, n_row)
    logical, intent(in) :: contact(:, :), stick(:, :)
    !> Law of friction; shear tractions stay as they are without friction, and without a bound
    class(friction_law_t), intent(in) :: friction
    !> Pressure and shear traction (n_col, n_row, component) [Pa]
    real(wp), intent(inout) :: traction(:, :, :)
    !> Space of the fields
    type(field_space_t), intent(in) :: space
    !> Allocated on failure: not enough memory, no convergence
    type(error_t), allocatable, intent(out) :: error
    !> Spectra that are kept
    type(kernel_cache_t), pointer, intent(in), optional :: cache
    !> Tuning numbers; absent: the usual ones
    type(edge_options_t), intent(in), optional :: options

    type(edge_options_t) :: tuning
    type(traction_field_t) :: edge_shape
    type(edged_zone_t) :: sticking
    type(edge_residue_t) :: residue
    type(fft_flexibility_t), target :: flexibility
    type(elastic_part_t) :: system
    real(wp), allocatable :: hats(:, :, :), change(:, :, :), at_nodes(:, :, :)
    integer :: pass, k, n

    if (present(options)) tuning = options
    n = merge(3, 1, friction%resists() .and. friction%is_bounded())
    call require_memory(edge_tractions_memory(lattice%extent, count(contact), n == 3, space%threads, spectra_of(medium)), error, &
                        space%threads)
    if (allocated(error)) return
    if (n == 3) then
      call new_traction_field(edge_shape, lattice, edges, traction, contact, stick, friction, tuning)
    else
      call new_traction_field(edge_shape, lattice, edges, traction(:, :, 1:1), contact, stick, options=tuning)
    end if
    call new_fft_flexibility(flexibility, lattice, medium, error, merge(of_pressure, of_all_tractions, n == 1), space, &
                              cache=cache)
    if (allocated(error)) return
    system%flexibility => flexibility
    system%space = space
    system%options = tuning
    allocate (change(lattice%extent(1), lattice%extent(2), n))
    do pass = 1, tuning%passes
      call sample(edge_shape, tuning%samples, n, residue, at_nodes)
      call residue%hats(space, hats, error)
      if (allocated(error)) return
      call residue%take_off(hats)
      call solve_again(system, medium, residue, contact, edge_shape, hats, change, error)
      if (allocated(error)) return
      if (pass == tuning%passes) exit
      at_nodes = traction(:, :, :n) + change + at_nodes - hats
      call fit_squares(edge_shape%squares, merge(at_nodes(:, :, 1), 0.0_wp, contact), edges%distances(), tuning)
      if (n == 3) then
        call edges%find_stick(stick, edge_shape%reserve, sticking)
        call fit_squares(edge_shape%stick_squares, &
                         merge(friction%bounds_of(at_nodes(:, :, 1)) - norm2(at_nodes(:, :, 2:3), dim=3), 0.0_wp, stick), &
                         sticking%distances(), tuning)
      end if
      call edge_shape%renew()
    end do
    do k = 1, n
      traction(:, :, k) = traction(:, :, k) + change(:, :, k)
    end do
  end subroutine correct_at_edges

  !> Sample the difference of the shape from its hats, between the nodes and at them.
  pure subroutine sample(shape_of, samples, n, residue, at_nodes)
    !> The shape
    type(traction_field_t), intent(in) :: shape_of
    !> Points along a spacing, and number of components
    integer, intent(in) :: samples, n
    !> Its part between the nodes
    type(edge_residue_t), intent(out) :: residue
    !> The same at the nodes (n_col, n_row, component) [Pa]
    real(wp), allocatable, intent(out) :: at_nodes(:, :, :)
    logical :: near(size(shape_of%squares, 1), size(shape_of%squares, 2))
    integer :: col, row, i, k

    do row = 1, size(near, 2)
      do col = 1, size(near, 1)
        near(col, row) = near_edge(shape_of, col, row, n)
      end do
    end do
    call new_edge_residue(residue, shape_of%lattice, samples, near, n)
    allocate (at_nodes(size(near, 1), size(near, 2), n), source=0.0_wp)
    do k = 1, size(residue%node, 2)
      associate (node => residue%node(:, k))
        if (.not. near(node(1), node(2))) cycle
        do i = 1, samples**2
          residue%values(i, :, k) = shape_of%beyond_hats(matmul(shape_of%lattice%basis, &
            real(shape_of%lattice%first + node - 1, wp) + residue%point(i)) + shape_of%lattice%origin)
        end do
        at_nodes(node(1), node(2), :) = residue%values(1, :, k)
      end associate
    end do
  end subroutine sample

  !> Compute the change of the nodal tractions that preserves the displacements of the nodes in contact, (I18).
  subroutine solve_again(system, medium, residue, contact, shape_of, hats, change, error)
    !> Elastic operator
    type(elastic_part_t), intent(inout) :: system
    !> The two bodies
    class(elastic_medium_t), intent(in) :: medium
    !> Traction between the nodes, less the hats
    type(edge_residue_t), intent(in) :: residue
    !> Nodes in contact (n_col, n_row)
    logical, intent(in) :: contact(:, :)
    !> The shape
    type(traction_field_t), intent(in) :: shape_of
    !> Hats that stand for the shape (n_col, n_row, component) [Pa]
    real(wp), intent(in) :: hats(:, :, :)
    !> Change of the tractions, the hats included (n_col, n_row, component) [Pa]
    real(wp), intent(out) :: change(:, :, :)
    !> Allocated on failure
    type(error_t), allocatable, intent(out) :: error
    real(wp), allocatable :: by_pressure(:, :, :), slope(:, :)
    integer :: k

    change = hats
    system%component = [normal]
    call settle(system, contact, residue%displacements(medium, contact, system%component), change(:, :, 1:1), error)
    if (allocated(error) .or. size(hats, 3) == 1) return
    slope = shape_of%friction%slopes_of(shape_of%nodal(:, :, 1))
    do k = 2, 3
      where (contact .and. .not. shape_of%stick)
        change(:, :, k) = hats(:, :, k) + slope*shape_of%direction(:, :, k - 1)*(change(:, :, 1) - hats(:, :, 1))
      end where
    end do
    if (.not. any(shape_of%stick)) return
    system%component = [along_x, along_y]
    allocate (by_pressure(size(contact, 1), size(contact, 2), 2), source=0.0_wp)
    if (medium%couples()) then
      call system%flexibility%apply([normal], change(:, :, 1:1), system%component, by_pressure, error)
      if (allocated(error)) return
    end if
    call settle(system, shape_of%stick, residue%displacements(medium, shape_of%stick, system%component) + by_pressure, &
                change(:, :, 2:3), error)
  end subroutine solve_again

  !> Change tractions of some nodes so that displacements become alike all over them, without any load.
  subroutine settle(system, nodes, moved, change, error)
    !> The operator of the components
    type(elastic_part_t), intent(inout) :: system
    !> The nodes (n_col, n_row)
    logical, intent(in) :: nodes(:, :)
    !> Displacements by anything else (n_col, n_row, component) [m]
    real(wp), intent(in) :: moved(:, :, :)
    !> Changes of the tractions; those of other nodes are given (n_col, n_row, component) [Pa]
    real(wp), intent(inout) :: change(:, :, :)
    !> Allocated on failure
    type(error_t), allocatable, intent(out) :: error
    real(wp), allocatable :: x(:), ax(:), rhs(:), unknown(:)
    type(constraints_t) :: constraints
    type(iteration_t) :: iteration
    logical(lk), allocatable :: active(:)
    type(active_set_t) :: set
    logical :: independent
    integer :: k

    if (.not. any(nodes)) return
    associate (n => size(nodes))
      active = reshape(spread(nodes, 3, size(change, 3)), [size(change)])
      x = reshape(change, [size(change)])
      rhs = merge(-reshape(moved, [size(change)]), 0.0_wp, active)
      call new_active_set(set, active, system%space)
      allocate (constraints%columns(set%n_active, size(change, 3)), source=0.0_wp)
      allocate (ax(size(x)))
      do k = 1, size(change, 3)
        constraints%columns((k - 1)*count(nodes) + 1:k*count(nodes), k) = 1.0_wp
      end do
      call precondition_constraints(system, set, size(x), constraints%columns, constraints%mb)
      call constraints%satisfy(system%space, -sum(reshape(x, [n, size(change, 3)]), dim=1), x, independent, set)
      call system%product(x, ax, error)
      if (allocated(error)) return
      iteration = iteration_t(tolerance=system%options%accuracy*maxval(abs(rhs - ax), mask=active), &
                              most=system%options%max_iterations)
      rhs = pack(rhs, active)
      unknown = pack(x, active)
      call projected_cg(system, set, constraints, rhs, unknown, ax, iteration, error)
      if (allocated(error)) return
      call set%unpack(unknown, x)
      if (iteration%outcome /= solution_accurate) call raise(error, status%no_convergence, not_found)
      change = reshape(x, shape(change))
    end associate
  end subroutine settle

  subroutine elastic_product(self, x, y, error)
    class(elastic_part_t), intent(inout) :: self
    real(wp), intent(in), contiguous, target :: x(:)
    real(wp), intent(out), contiguous, target :: y(:)
    type(error_t), allocatable, intent(out) :: error
    real(wp), pointer, contiguous :: acting(:, :, :), wanted(:, :, :)

    associate (n => self%flexibility%lattice%extent, c => self%component)
      acting(1:n(1), 1:n(2), 1:size(c)) => x
      wanted(1:n(1), 1:n(2), 1:size(c)) => y
      call self%flexibility%apply(c, acting, c, wanted, error)
    end associate
  end subroutine elastic_product

  !> Return whether a triangle at a node may have squares.
  pure logical function near_edge(shape_of, col, row, n)
    !> The shape
    type(traction_field_t), intent(in) :: shape_of
    !> Column and row, counted from 1
    integer, intent(in) :: col, row
    !> Number of components
    integer, intent(in) :: n

    associate (c => [max(col - 1, 1), min(col + 1, size(shape_of%squares, 1))], &
               r => [max(row - 1, 1), min(row + 1, size(shape_of%squares, 2))])
      near_edge = .not. all(ieee_is_nan(shape_of%squares(c(1):c(2), r(1):r(2))))
      if (n > 1) near_edge = near_edge .or. .not. all(ieee_is_nan(shape_of%stick_squares(c(1):c(2), r(1):r(2))))
    end associate
  end function near_edge

end module hc_edge_tractions
